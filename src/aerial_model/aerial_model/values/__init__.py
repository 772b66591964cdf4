"""The values that planner, controller, simulator and operator exchange."""
