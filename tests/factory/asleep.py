"""What a Dask worker is asked to run in a test: it says that it runs, in the file that is its order, and sleeps."""

import os
import sys
import time
from pathlib import Path

if __name__ == "__main__":
    Path(sys.stdin.read()).write_text(str(os.getpid()))
    time.sleep(600)
