"""How runs that were begun with a Prefect server end."""

from __future__ import annotations

import time
from collections.abc import Sequence
from uuid import UUID

from prefect.client.orchestration import SyncPrefectClient
from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterId
from prefect.client.schemas.objects import State
from prefect.states import Failed

AT_ONCE = 100  # runs asked for in one request
_ASK_EVERY_S = 5.0


def ends_of(client: SyncPrefectClient, runs: Sequence[UUID]) -> dict[UUID, State]:
    """Wait for runs to end, and return their last states.

    One that crashed may be put back in line by its worker: that is an end when it stays so.
    """
    ends: dict[UUID, State] = {}
    crashed: set[UUID] = set()
    while waiting := [run for run in runs if run not in ends]:
        time.sleep(_ASK_EVERY_S)
        for start in range(0, len(waiting), AT_ONCE):
            asked = waiting[start : start + AT_ONCE]
            found = client.read_flow_runs(flow_run_filter=FlowRunFilter(id=FlowRunFilterId(any_=asked)), limit=AT_ONCE)
            states = {run.id: run.state for run in found}
            now = {run: states.get(run, Failed(message="its run was deleted")) for run in asked}
            final = {run: state for run, state in now.items() if state and state.is_final()}
            ends |= {run: state for run, state in final.items() if not state.is_crashed() or run in crashed}
            crashed = crashed - now.keys() | {run for run, state in final.items() if state.is_crashed()}
    return ends
