"""What a person touches: the command line, selections, recordings."""
