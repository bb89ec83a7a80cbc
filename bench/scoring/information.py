"""What rows of one table do not share: who used what came with the measurements, whose answer hangs on names."""

from typing import TYPE_CHECKING

from bench.execution.given import BY_NAME
from bench.plugins.selection import label

if TYPE_CHECKING:
    import pandas as pd


def notes_on_use(frame: "pd.DataFrame", offered: "pd.Series[str]") -> list[str]:
    """A sentence for every instance whose measurements came with more, such as weights, and for each of these.

    Parameters
    ----------
    frame
        Scored rows, with the column ``used``.
    offered
        For each row, what came with the measurements, parted by spaces.
    """
    sentences: dict[str, None] = {}
    carrying = frame.assign(offered=offered)[(offered != "").to_numpy() & (frame["outcome"] == "ok").to_numpy()]
    for (dataset, instance), rows in carrying.groupby(["dataset", "instance"], sort=False):
        for name in rows["offered"].iloc[0].split():
            users: list[str] = []
            others: list[str] = []
            for method, params, used in zip(rows["method"], rows["params"], rows["used"], strict=True):
                (users if name in used.split() else others).append(label(method, params))
            sentences[f"{dataset}/{instance}: {_sentence(name, users, others)}"] = None
    return list(sentences)


def notes_on_names(frame: "pd.DataFrame") -> list[str]:
    """A sentence for the methods whose answers depend on the names of the cameras, where one seed cannot show that."""
    by_name = frame[frame["notes"].str.contains(BY_NAME, regex=False)]
    alone = by_name.groupby(["dataset", "instance", "method", "params"], sort=False).filter(lambda rows: len(rows) == 1)
    labels = dict.fromkeys(map(label, alone["method"], alone["params"]))
    return [f"{', '.join(labels)}: {BY_NAME} (--seeds)"] if labels else []


def _sentence(name: str, users: list[str], others: list[str]) -> str:
    listed = [", ".join(dict.fromkeys(methods)) for methods in (users, others)]
    if users and others:
        return f"the {name} of the measurements were used by {listed[0]}; not by {listed[1]}"
    return f"the {name} of the measurements were used by {'all' if users else 'none'}"
