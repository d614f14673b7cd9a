"""The work of the data factory, stage by stage. Importable without prefect, mlflow, bpy or torch.

`stages.py` lists the stages in the order of the data; each package below does one of them.
"""

__version__ = "0.6.0"
