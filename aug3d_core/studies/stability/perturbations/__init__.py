"""What is done to the factory, one module for each chapter of the page; `catalogue` lists them all.

Marks are set before anything is measured, and say where they come from; one that was not, in `boxes`, says so.
"""
