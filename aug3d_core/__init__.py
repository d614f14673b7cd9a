"""The data factory, stage by stage. Importable without prefect, mlflow, bpy or torch.

`factory/stages.py` lists the stages in order. CONTRIBUTING.md lists the packages and their layers.
"""

__version__ = "0.7.0"
