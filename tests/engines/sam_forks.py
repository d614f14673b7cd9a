"""A process that has imported torch and transformers, which takes seconds, and does each piece of work in a fork of itself.

It reads on its standard input the job of a `sam_worker`, or a folder for `made_up_weights`, line by line.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

from aug3d_core.run.helper_process import WorkerDied
from aug3d_core.run.stage import Frozen

_ENDED = "ended with"


class SamForks:
    """The process, for as long as the context lasts."""

    def __enter__(self) -> SamForks:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.engines.sam_forks"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.communicate()

    def make_weights(self, folder: Path) -> None:
        assert self._work(folder, print) == 0

    def run_worker(self, module: str, job: Frozen, on_report: Callable[[str], None], name: str, lighter: str) -> None:
        """Do what `helper_process.run_worker` does for the one module that was imported."""
        assert module == "aug3d_core.domes.methods.sam_worker"
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "job.json"
            file.write_text(job.model_dump_json())
            if status := self._work(file, on_report):
                raise WorkerDied(f"{name} ended with {status}", lighter)

    def _work(self, path: Path, on_report: Callable[[str], None]) -> int:
        assert self._process.stdin and self._process.stdout
        print(path, file=self._process.stdin, flush=True)
        for line in self._process.stdout:
            if line.startswith(_ENDED):
                return int(line.removeprefix(_ENDED))
            on_report(line.rstrip("\n"))
        raise AssertionError("the process is gone")


def made_up_weights(folder: str) -> None:
    """Save a small model that is sure of everything, and whose logits are so large that outlines are stable."""
    import torch
    from transformers import SamConfig, SamModel

    torch.manual_seed(3)
    vision = dict(
        hidden_size=16, num_hidden_layers=2, num_attention_heads=2, image_size=64, patch_size=8, mlp_dim=32,
        output_channels=16, global_attn_indexes=[1], window_size=4, num_pos_feats=8,
    )  # fmt: skip
    prompt = dict(hidden_size=16, image_size=64, patch_size=8, mask_input_channels=4, image_embedding_size=8)
    mask = dict(hidden_size=16, mlp_dim=32, num_attention_heads=2, iou_head_hidden_dim=16)
    model: Any = SamModel(SamConfig(vision_config=vision, prompt_encoder_config=prompt, mask_decoder_config=mask))
    with torch.no_grad():
        model.mask_decoder.iou_prediction_head.proj_out.bias.fill_(1.0)
        for head in model.mask_decoder.output_hypernetworks_mlps:
            head.proj_out.weight.mul_(1e9)
    model.save_pretrained(folder)


def main() -> None:
    from aug3d_core.domes.methods import sam_worker

    while path := sys.stdin.readline().rstrip("\n"):
        if (child := os.fork()) == 0:
            if Path(path).is_dir():
                made_up_weights(path)
            else:
                sys.argv = [sys.argv[0], path]
                sam_worker.main()
            sys.stdout.flush()
            os._exit(0)
        _, status = os.waitpid(child, 0)
        print(_ENDED, status, flush=True)
    os._exit(0)  # torch takes its time to end


if __name__ == "__main__":
    main()
