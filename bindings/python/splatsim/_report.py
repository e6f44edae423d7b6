"""Reports: JSON objects as attributes, lists of them as Arrow tables; and progress bars."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import pyarrow as pa

#: Called at intervals with the finished amount, the total if known, and a message.
Progress = Callable[[float, float | None, str], object]


class Node(Mapping[str, Any]):
    """An object of a report: its fields are attributes and items."""

    def __init__(self, fields: dict[str, Any]) -> None:
        self._fields = fields

    def __getattr__(self, name: str) -> Any:
        try:
            return _wrapped(self.__dict__["_fields"][name])
        except KeyError:
            raise AttributeError(f"the report has no {name} here; it has {', '.join(self.__dict__.get('_fields', ()))}") from None

    def __getitem__(self, name: str) -> Any:
        return _wrapped(self._fields[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self._fields)

    def __len__(self) -> int:
        return len(self._fields)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._fields]

    def __repr__(self) -> str:
        return json.dumps(self._fields, indent=2, ensure_ascii=False)

    def dict(self) -> dict[str, Any]:
        """The plain dicts and lists."""
        return self._fields


def _wrapped(value: Any) -> Any:
    if isinstance(value, dict):
        return Node(value)
    if isinstance(value, list):
        return [_wrapped(item) for item in value]
    return value


def table(rows: list[dict[str, Any]]) -> pa.Table:
    """Rows as an Arrow table: fields of objects become columns, `account.busy` and so on."""
    flat = [dict(_flat(row, "")) for row in rows]
    names = list(dict.fromkeys(name for row in flat for name in row))
    return pa.table({name: [row.get(name) for row in flat] for name in names})


def _flat(fields: dict[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    for name, value in fields.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield prefix + name, value


def shown(progress: Progress | bool) -> Progress | None:
    """A callback; for True tqdm's bar, if tqdm is installed."""
    if not isinstance(progress, bool):
        return progress
    if not progress:
        return None
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return None
    bar = tqdm()

    def report(done: float, total: float | None, message: str) -> None:
        bar.total = total
        bar.n = done
        bar.set_postfix_str(message)

    return report
