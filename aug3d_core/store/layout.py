"""The only place that spells a path: the folders of the store, and the files inside each stage's output."""

from __future__ import annotations

# The store
OBJECTS = "objects"
WORK = "work"
LOCKS = "locks"
IN_USE = "in_use.lock"
FAILURES = "failures"
SCENES = "scenes"
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
PREFECT_RESULTS = "prefect/results"
MLFLOW_DATABASE = "mlflow.db"
MLFLOW_ARTIFACTS = "mlflow-artifacts"
SERVICES = "services"  # logs and passwords of the servers: only its owner may read it
SERVICES_LOCK = "up.lock"
SERVICES_RUNNING = "up.json"
WORKER_READY = "worker.ready"
MLFLOW_AUTH_CONFIG = "mlflow_auth.ini"
MLFLOW_AUTH_DATABASE = "mlflow_auth.db"
MLFLOW_OUTBOX = "mlflow-outbox"

# One object
FILES = "files"
RECORD = "record.json"
JOB = "job.json"
LOG = "log.txt"
OUTCOME = "outcome.json"
ERROR = "error.json"
PROGRESS = "progress.json"
SPENT = "spent.json"
EARLIER = "earlier"
GONE = ".gone-"  # begins the name of an object that is being deleted

# testbed: `photos/` is what a user would have; `truth/` is kept apart and read by truth metrics alone
TOWN_PHOTOS = "photos"
TOWN_TRUTH = "truth"
TRUTH_POSES = "truth/poses.npz"
TRUTH_LENS = "truth/lens.json"
TRUTH_MESH = "truth/mesh.ply"
TRUTH_FOOTPRINTS = "truth/footprints.json"

# photos
PHOTO_TABLE = "photos.parquet"
REJECTED_TABLE = "rejected.parquet"
PHOTO_IMAGES = "images"
CONTACT_SHEET = "contact_sheet.jpg"

# poses
GIVEN_POSES = "poses.json"
GIVEN_MODEL = "model"

# matching
FEATURES = "features.db"
MATCHING_TABLE = "matching.parquet"

# sfm
VIEWS = "views.npz"
VIEW_IMAGES = "images"
POINTS = "points.npz"
TRACKS = "tracks.npz"
WORLD = "world.json"
COLMAP_MODEL = "model"
COMPONENTS = "components.json"
OTHER_MODELS = "other_models"
UNPLACED = "unplaced.parquet"
SFM_MAP = "map.png"

# grouping
SHARED_POINTS = "shared_points.npz"
SPLIT_TABLE = "split.parquet"
LEFT_OUT_TABLE = "left_out.parquet"
GROUPS = "groups.npz"
SIMILARITY_PICTURE = "similarity.png"
GROUPING_MAP = "grouping.png"

# overlap
OVERLAP_TABLE = "overlap.parquet"
OVERLAP_MEMBERS = "overlap_members.parquet"
GROUPS_MAP = "groups_map.png"
GROUPS_COLUMNS = "groups_columns.jpg"

# depth: `workspace/` is COLMAP's dense workspace
DENSE_WORKSPACE = "workspace"
WORKSPACE_DEPTH_MAPS = "stereo/depth_maps"
WORKSPACE_NORMAL_MAPS = "stereo/normal_maps"
DEPTH_MAPS = f"{DENSE_WORKSPACE}/{WORKSPACE_DEPTH_MAPS}"
NORMAL_MAPS = f"{DENSE_WORKSPACE}/{WORKSPACE_NORMAL_MAPS}"
FUSED = "fused.npz"
BASELINE_FUSED = "baseline_fused.npz"
DEPTH_SHEET = "depth_and_normals.png"

# surface
MESH = "mesh.ply"
BASELINE_MESH = "baseline_mesh.ply"
BASELINE_RENDERS = "baseline_renders"
TEXTURED_MESH = "mesh_textured.npz"
MESH_TEXTURE = "mesh_texture.png"
BASELINE_TEXTURED_MESH = "baseline_mesh_textured.npz"
BASELINE_MESH_TEXTURE = "baseline_mesh_texture.png"
MESH_SOURCES = "mesh_sources.json"

# sampling
CAMERAS = "cameras.npz"
DOME_TABLE = "domes.parquet"
BUILDINGS = "buildings.npz"
BUILDINGS_MAP = "buildings.png"
SAMPLING_MAP = "map.png"
COVERAGE_CHART = "coverage.png"

# rendering
SHARDS = "shards"
RENDER_TABLE = "renders.parquet"

# dataset
SCENE_ZARR = "scene.zarr"
LEAK_AUDIT = "leak_audit.json"

# nerf
MODEL_WEIGHTS = "model.safetensors"
MODEL_CONFIG = "model.json"
CHECKPOINT = "checkpoint"
CURVE = "curve.parquet"
TEST_VIEWS = "test_views.parquet"
PANELS = "panels"
FLYTHROUGH = "flythrough.webp"
CONVENTIONS = "conventions.json"
PREDICTION = "prediction.png"
PREDICTION_DEPTH = "depth.png"
PREDICTION_PANEL = "panel.png"
PREDICTION_VIEW = "view.json"

# charts
REPORT = "report.html"
METRICS = "metrics.json"
PUBLISHED = "published.json"


def image_name(photo_id: int) -> str:
    """Name of a photograph's file inside `images/`, in any stage."""
    return f"{photo_id:06d}.png"


def shard_name(shard: int) -> str:
    """Name of one render shard's file inside `shards/`."""
    return f"{shard:04d}.npz"


def geometric_map_name(photo_id: int) -> str:
    """Name of a photograph's file inside COLMAP's `depth_maps/` and `normal_maps/`."""
    return f"{image_name(photo_id)}.geometric.bin"
