"""What is done to the factory, one module for each chapter of the page; `catalogue` lists them all.

Marks are set before anything is measured, and say where they come from; one that was not, in `boxes`, says so.

photographs    photographs that are hard to put together
positions      GPS that is noisy or wrong
ground         land that is not level
edge_cases     the paper's edge cases of grouping
groups         groups that ask for more than photographs share
surface        points that float, are missing or turned, triangles that are dropped
boxes          the finder of buildings
virtual_views  noise, domes that sink, photographs of the test that leak
learning       training and test
"""
