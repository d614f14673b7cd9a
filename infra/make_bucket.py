"""Make the bucket that MLflow's artifacts go to, unless it is there."""

import os
from urllib.parse import urlsplit

import boto3

s3 = boto3.client("s3", endpoint_url=os.environ["MLFLOW_S3_ENDPOINT_URL"])
bucket = urlsplit(os.environ["MLFLOW_ARTIFACTS_DESTINATION"]).netloc
if bucket not in [known["Name"] for known in s3.list_buckets()["Buckets"]]:
    s3.create_bucket(Bucket=bucket)
print(f"bucket {bucket} is there")
