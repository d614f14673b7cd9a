"""The test split: a block of ground for the test, a gap around it, the rest for training.

split    which photographs are which
earlier  the test of a scene before it grew
"""
