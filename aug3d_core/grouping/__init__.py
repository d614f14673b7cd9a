"""Decide which photographs belong together, and which of them are kept for the test.

similarity        visibility -> number of shared points of every pair of views
similarity_stage  the stage that writes it
scene             what every way of grouping may look at
spread            choose centres evenly over the ground
shared_points     group by shared points
split             a block of ground for the test, a gap around it, the rest for training
audit             figures that say how good groups and split are
picture           the pictures that people look at
stage             the stage
"""
