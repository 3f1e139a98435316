"""Makes the pages of the documentation that follow from the code, and gathers them with those that are written."""
