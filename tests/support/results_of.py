"""Results of an experiment, made up for tests."""

from typing import Any


def data_of(rows: list[dict[str, Any]], **changes: Any) -> dict[str, Any]:
    """Return results with everything that a record needs."""
    head = {
        "schema": "wamnet-experiment-2",
        "experiment": "study",
        "commands": ["python experiments/study.py"],
    }
    facts = {"machine": {"cores": "2", "processor": "a processor"}, "versions": {"numpy": "2.0"}}
    return {**head, "settings": {"scale": "small"}, **facts, "records": rows, **changes}
