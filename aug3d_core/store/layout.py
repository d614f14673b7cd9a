"""The only place that names the folders and files of a home and of a shared store.

The files of a job are named in `run/files.py`, those inside a stage's output in the `files.py` of its package.
"""

from __future__ import annotations

SHARED_VARIABLE = "AUG3D_STORE"  # names what several machines share, beside the home folder of each

# The store
OBJECTS = "objects"
WORK = "work"
LOCKS = "locks"
IN_USE = "in_use.lock"
FAILURES = "failures"
SCENES = "scenes"
COLLECTIONS = "collections"  # of scenes: their files, and the versions of the model of each
SCENE_FILES = (".yaml", ".yml")  # the registry: how the file of a scene may end, the first when it is written
BENCH = "bench"
BENCH_FIGURES = "figures.json"
BENCH_PICTURES = "pictures"
STUDIES = "studies"
STUDY_FINDINGS = "study.json"
STUDY_SCORES = "scores.parquet"
STUDY_CHART = "chart.png"
STUDY_PAGE = "study.html"
STUDY_PART = "part.json"
STORY = "story.html"
PREFECT = "prefect"
ALIVE = "prefect/alive"
MLFLOW_DATABASE = "mlflow.db"
MLFLOW_ARTIFACTS = "mlflow-artifacts"
SERVICES = "services"  # logs and token of the servers: only its owner may read it
SERVICES_LOCK = "up.lock"
SERVICES_RUNNING = "up.json"
SERVICES_TOKEN = "token"
WORKER_READY = "worker.ready"
MLFLOW_OUTBOX = "mlflow-outbox"

# Only in a store that several machines share
BLOBS = "blobs"  # the bytes of files, under their SHA-256
LEASES = "leases"
PHOTOGRAPHS = "photographs"  # of each scene, the digest that the machine told last that has them
CLOCK = "gc/clock"
MARKS = "gc/marks"  # what nobody needed when someone looked
USED = "gc/used"  # objects that a machine began to use although they were marked

# One object
RECORD = "record.json"
GONE = ".gone-"  # begins the name of an object that is being deleted
DAMAGED = ".damaged-"  # begins the name of what was put aside because its bytes are not those that were written

# charts
REPORT = "report.html"
METRICS = "metrics.json"
TOLD = "told"  # beside a version's figures: whoever is to know of it does
PUBLISHED = "published.json"
