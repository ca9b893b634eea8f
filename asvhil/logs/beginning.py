"""What stands before the data of a log's file, header and metadata, and which of it is damaged."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from asvhil.logs.metadata import (
    CONTINUED_RECORD,
    LAYOUT_RECORD,
    PROFILE,
    Found,
    closing_is_damaged,
    damaged_names,
    digest,
    digests_of,
    is_closing,
)


class Beginning:
    """The records before the data, the header first.

    `metadata` are those by name, without the closing one, which is `closing`: None where it is missing or damaged.
    """

    def __init__(self, found: Iterable[Found]) -> None:
        self._found = list(found)
        self._misnamed = _named_by_digest(self._found[1:])
        named = {self._name(one): one.values for one in self._found[1:] if one.name is not None}
        closing = named.pop(LAYOUT_RECORD, None)
        self.closed = closing is not None
        self.closing = None if closing is None or closing_is_damaged(closing) else closing
        self.goes_on_in = named.pop(CONTINUED_RECORD, {}).get("in", "")
        self.metadata = named

    @property
    def profile(self) -> str | None:
        """Of the header; None where that cannot be read."""
        return self._found[0].name if self._found else None

    @property
    def is_complete(self) -> bool:
        """Whether all records are found that the closing one counts."""
        return self.closing is not None and self.closing.get("records") == str(len(self.metadata))

    def damaged(self) -> dict[str, str]:
        """What is damaged, by the name of the record; a name that is not known is its offset."""
        offsets = {self._name(one): one.offset for one in self._found[1:] if one.name is not None}
        unread = [one.offset for one in self._found[1:] if one.name is None]
        lines = dict(self._of_the_header())
        for name in damaged_names(self.metadata, self.closing):
            at = offsets.get(name)
            if at is None:
                at = unread.pop(0) if unread else None
            lines[name] = f"damaged: {name} record ({'not found' if at is None else f'byte {at}'})"
        if self.closing is None:
            at = offsets.get(LAYOUT_RECORD, unread.pop(0) if unread else None)
            lines[LAYOUT_RECORD] = f"damaged: closing metadata record ({'not found' if at is None else f'byte {at}'})"
        elif not self.is_complete and not lines:
            count = self.closing.get("records")
            lines[LAYOUT_RECORD] = f"damaged: {len(self.metadata)} of {count} metadata records are found"
        lines |= {f"byte {at}": f"damaged: the record at byte {at}" for at in unread}
        for one in self._found[1:]:
            name = self._name(one)
            if (one.mended or one.offset in self._misnamed) and name and name not in lines:
                # Under another name: what the record says can be trusted.
                lines[f"head of {name}"] = _head(one, name)
        return lines

    def _of_the_header(self) -> Iterator[tuple[str, str]]:
        if not self._found:
            return
        header = self._found[0]
        if header.mended and header.name == PROFILE:
            yield "head of header", _head(header, "header")
        elif header.name != PROFILE:
            yield "header", f"damaged: header record (byte {header.offset})"

    def _name(self, one: Found) -> str:
        return self._misnamed.get(one.offset, one.name or "")


def _named_by_digest(found: list[Found]) -> dict[int, str]:
    """The names, by offset, of records that have a damaged one but the content that the closing record tells of."""
    closing = next((one for one in found if is_closing(one.values)), None)
    if closing is None:
        return {}
    names = {value: name for name, value in digests_of(closing.values).items()}
    read = {one.name for one in found}
    named = {one.offset: names.get(digest(one.values), "") for one in found if one.name is not None}
    missing = {offset: name for offset, name in named.items() if name and name not in read}
    return missing if closing.name == LAYOUT_RECORD else missing | {closing.offset: LAYOUT_RECORD}


def _head(one: Found, name: str) -> str:
    return f"damaged: head of the {name} record (byte {one.offset}); its content is intact"
