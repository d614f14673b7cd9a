"""The test split: a block of ground for the test, a gap around it, the rest for training."""
