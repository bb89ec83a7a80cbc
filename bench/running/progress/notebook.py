"""Progress of a run in a notebook: one output that is replaced as jobs end."""

import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bench.running.engines.local import Finished
    from bench.running.run import Run

EVERY_S = 0.5
WIDTH = 100  # characters of the board


def in_notebook() -> bool:
    """Whether this is the kernel of a notebook, which shows what is given to it; a terminal of IPython is none."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


def watched(planned: "Run") -> Iterator["Finished"]:
    """Run what is to do; yield each job as it ends, and show the board below the cell meanwhile."""
    from IPython import display as shown_by_jupyter

    from bench.running.progress.board import Board
    from bench.running.progress.live import workers_of
    from bench.running.progress.past import Past

    past = Past(planned)
    in_order = planned.options.engine == "local" and not planned.options.timing
    jobs = [cell.job for cell in planned.todo]
    board = Board(jobs, past.task, past.pace, workers_of(planned), in_order=in_order)
    display: Any = shown_by_jupyter.display  # its types are only there where IPython is
    shown = display(_Text(board), display_id=True)
    drawn = time.monotonic()
    for finished in planned.execute():
        board.end(finished[0].job, finished[1])
        if time.monotonic() - drawn > EVERY_S:
            shown.update(_Text(board))
            drawn = time.monotonic()
        yield finished
    shown.update(_Text(board))


class _Text:
    """What a notebook prints of a board."""

    def __init__(self, board: object) -> None:
        from rich.console import Console

        console = Console(width=WIDTH, color_system=None, force_jupyter=False)
        with console.capture() as capture:
            console.print(board)
        self._text = capture.get()

    def __repr__(self) -> str:
        return self._text
