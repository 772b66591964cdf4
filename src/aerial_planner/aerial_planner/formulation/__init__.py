"""The optimal control problems: single rigid body, kino-dynamic, and the thesis's own."""
