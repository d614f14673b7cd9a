"""Prefect tasks: cache, retry, isolate, report. The arithmetic is in `aug3d_core`."""
