"""The loop closed in one process: scenarios, campaigns, tables."""
