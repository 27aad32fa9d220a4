"""A recorder led through a block by a thread."""

from ctypes import Structure, addressof, c_double, c_int64, c_void_p, cast

import numpy as np

from cosim.coupling.batch.threads import compiled
from cosim.coupling.loop.recorder import STEPS, Block, Recorder

_, _FAILED, _TO_JUDGE = range(3)  # outcomes


class Intervals(Structure):
    """``Following`` of ``threads.h``, which says what it holds."""

    _fields_ = (
        *((name, c_void_p) for name in ("recorder", "edges", "start", "end")),
        *((name, c_int64) for name in ("n", "done", "at_once", "most")),
        *(("internal", c_void_p), ("enough", c_double)),
    )


class Following:
    """Has a recorder led through a block, as its ``follow`` would."""

    def __init__(self, recorder: Recorder, block: Block) -> None:
        self._recorder = recorder
        self._block = edges, start, end = tuple(np.ascontiguousarray(values) for values in block)
        self.run = cast(compiled().following_run, c_void_p).value or 0
        self.arguments = Intervals(
            recorder=addressof(recorder.state),
            **{"edges": edges.ctypes.data, "start": start.ctypes.data, "end": end.ctypes.data},
            **{"n": len(edges), "at_once": recorder.at_once, "most": STEPS},
            internal=addressof(recorder.mechanics.places["internal"]),
            enough=recorder.pace.enough,
        )

    def goes_on(self, outcome: int) -> bool:
        """Whether there is more to be led through. Raises what ``follow`` would raise."""
        recorder, intervals = self._recorder, self.arguments
        recorder.at_once = intervals.at_once
        if outcome == _FAILED:
            raise recorder.failure()
        if outcome == _TO_JUDGE:
            recorder.tell()
            intervals.enough = recorder.pace.enough
        return intervals.done < intervals.n
