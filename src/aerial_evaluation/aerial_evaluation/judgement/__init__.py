"""What came of a motion: landed or not, how close to its plan, how good the estimate was."""
