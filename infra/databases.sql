-- Run once, by the image of PostgreSQL, when its folder is empty: Prefect's database is made by the image, this is MLflow's.
CREATE DATABASE mlflow;
