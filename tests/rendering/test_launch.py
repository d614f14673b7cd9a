"""Shards are shared among workers, kept when they exist, and go on in another process when one ends early."""

from pathlib import Path

import pytest

from aug3d_core.rendering import launch
from aug3d_core.rendering.job import MeshFile, RenderJob, Shard, ViewDone
from aug3d_core.rendering.launch import Spent, render
from aug3d_core.run.helper_process import WorkerDied

VIEWS = 3  # in each shard


def job(folder: Path, shards: int = 4) -> RenderJob:
    return RenderJob(
        meshes=(MeshFile(path=folder / "mesh.ply"),),
        cameras=folder / "c.npz",
        shards=tuple(
            Shard(first=i * VIEWS, last=(i + 1) * VIEWS, out=folder / f"{i}.npz", samples=1) for i in range(shards)
        ),
    )


class Workers:
    """Stand in for worker processes: each grows by 10 MiB a view and ends after `most` shards."""

    def __init__(self) -> None:
        self.asked: list[list[str]] = []
        self.most = 100

    def run(self, module, given, on_report, name, lighter) -> None:
        assert module == "aug3d_core.rendering.worker" and "triangles" in lighter
        assert given.shards[0].out.name in name
        self.asked.append([shard.out.stem for shard in given.shards])
        memory = 100.0
        for shard in given.shards[: self.most]:
            for _ in range(shard.last - shard.first):
                on_report(ViewDone(cycles_s=0.5, resident_mib=memory).model_dump_json())
                memory += 10
            shard.out.touch()


@pytest.fixture
def workers(monkeypatch) -> Workers:
    stand_in = Workers()
    monkeypatch.setattr(launch, "run_worker", stand_in.run)
    return stand_in


def test_views_are_told_as_they_are_done_and_what_they_cost(workers, tmp_path):
    told = []
    spent = render(job(tmp_path), told.append)
    assert told == list(range(1, 13))
    assert (spent.views, spent.cycles_s, spent.growth_mib) == (12, 6.0, 110.0)
    assert spent.worker_s > 0


def test_shards_are_shared_among_workers(workers, tmp_path):
    told = []
    render(job(tmp_path, 5), told.append, workers=2)
    assert sorted(workers.asked) == [["0", "2", "4"], ["1", "3"]]
    assert told == list(range(1, 16))


def test_shards_that_exist_are_kept(workers, tmp_path):
    (tmp_path / "1.npz").touch()
    assert render(job(tmp_path), lambda _: None).views == 9
    assert workers.asked == [["0", "2", "3"]]
    nothing = render(job(tmp_path), lambda _: None, workers=2)
    assert nothing == Spent() and nothing.overhead_share is None


def test_another_worker_goes_on_where_one_ended_early(workers, tmp_path):
    workers.most = 1
    spent = render(job(tmp_path, 3), lambda _: None)
    assert workers.asked == [["0", "1", "2"], ["1", "2"], ["2"]]
    assert (spent.views, spent.growth_mib) == (9, 20.0)


def test_a_worker_that_leaves_nothing_has_failed(workers, tmp_path):
    workers.most = 0
    with pytest.raises(WorkerDied, match=r"0\.npz ended without its shard"):
        render(job(tmp_path), lambda _: None)
    assert len(workers.asked) == 1


def test_overhead_is_what_is_not_cycles():
    assert Spent(views=1, worker_s=10.0, cycles_s=9.0).overhead_share == pytest.approx(0.1)
