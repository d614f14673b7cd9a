"""Studies: the paper's tables, time against accuracy, stability; `common` holds what they share."""
