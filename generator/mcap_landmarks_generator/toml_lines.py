"""Where each value of a TOML text stands, so that an error can name its line."""

from collections import Counter

KeyPath = tuple[str | int, ...]


def lines_of(text: str) -> dict[KeyPath, int]:
    """Line number, from 1, of every table, key and array element of a valid TOML text.

    The key path of `b` in the second `[[a]]` is ("a", 1, "b").
    """
    return _Scanner(text).scan()


class _Scanner:
    """Walks over a text that `tomllib` accepts, so it checks nothing."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._at = 0
        self._found: dict[KeyPath, int] = {}
        self._table: KeyPath = ()
        self._counts: Counter[KeyPath] = Counter()

    def scan(self) -> dict[KeyPath, int]:
        while self._skip_blank():
            if self._text[self._at] == "[":
                self._header()
            else:
                self._pair(self._table)
        return self._found

    def _note(self, key_path: KeyPath) -> None:
        for length in range(1, len(key_path) + 1):
            self._found.setdefault(key_path[:length], self._text.count("\n", 0, self._at) + 1)

    def _skip_blank(self) -> bool:
        """Pass spaces, newlines, commas and comments; False at the end of the text."""
        while self._at < len(self._text):
            if self._text[self._at] == "#":
                self._at = (self._text.find("\n", self._at) + 1) or len(self._text)
            elif self._text[self._at] in " \t\r\n,":
                self._at += 1
            else:
                return True
        return False

    def _header(self) -> None:
        """`[table]` or `[[array of tables]]`; in arrays of tables the latest element is meant."""
        is_array = self._text.startswith("[[", self._at)
        self._at += 1 + is_array
        key_path: KeyPath = ()
        keys = self._keys("]")
        for i, key in enumerate(keys):
            key_path = (*key_path, key)
            last = i == len(keys) - 1
            if last and is_array:
                self._counts[key_path] += 1
            if key_path in self._counts:
                key_path = (*key_path, self._counts[key_path] - 1)
        self._table = key_path
        self._note(key_path)
        self._at += is_array

    def _pair(self, inside: KeyPath) -> None:
        """`key = value`, also with a dotted key."""
        start = self._at
        key_path = (*inside, *self._keys("="))
        here, self._at = self._at, start
        self._note(key_path)
        self._at = here
        self._value(key_path)

    def _keys(self, end: str) -> list[str]:
        """The parts of a dotted key up to the character `end`, which is passed."""
        parts = [""]
        while self._text[self._at] != end:
            character = self._text[self._at]
            if character in "\"'":
                start = self._at + 1
                self._string()
                parts[-1] += self._text[start : self._at - 1]
                continue
            if character == ".":
                parts.append("")
            elif character not in " \t":
                parts[-1] += character
            self._at += 1
        self._at += 1
        return parts

    def _value(self, key_path: KeyPath) -> None:
        while self._text[self._at] in " \t":
            self._at += 1
        character = self._text[self._at]
        if character == "[":
            self._array(key_path)
        elif character == "{":
            self._inline_table(key_path)
        elif character in "\"'":
            self._string()
        else:
            while self._at < len(self._text) and self._text[self._at] not in ",]}\n#":
                self._at += 1

    def _array(self, key_path: KeyPath) -> None:
        self._at += 1
        index = 0
        while self._skip_blank() and self._text[self._at] != "]":
            self._note((*key_path, index))
            self._value((*key_path, index))
            index += 1
        self._at += 1

    def _inline_table(self, key_path: KeyPath) -> None:
        self._at += 1
        while self._skip_blank() and self._text[self._at] != "}":
            self._pair(key_path)
        self._at += 1

    def _string(self) -> None:
        """Pass a string of any of TOML's four kinds."""
        mark = self._text[self._at]
        quote = mark * 3 if self._text.startswith(mark * 3, self._at) else mark
        self._at += len(quote)
        while not self._text.startswith(quote, self._at):
            self._at += 2 if mark == '"' and self._text[self._at] == "\\" else 1
        self._at += len(quote)
        while len(quote) == 3 and self._text.startswith(mark, self._at):
            self._at += 1
