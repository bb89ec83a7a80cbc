"""Who used what came with the measurements: rows of one table that differ in this are not rivals on equal terms."""

from typing import TYPE_CHECKING

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


def _sentence(name: str, users: list[str], others: list[str]) -> str:
    listed = [", ".join(dict.fromkeys(methods)) for methods in (users, others)]
    if users and others:
        return f"the {name} of the measurements were used by {listed[0]}; not by {listed[1]}"
    return f"the {name} of the measurements were used by {'all' if users else 'none'}"
