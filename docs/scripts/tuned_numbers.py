"""Count the tuned numbers between an image and a pose.

    python3 docs/scripts/tuned_numbers.py [--list]

A tuned number is, in the sources of problem, factor, strategy, tracker, search and scene/region (without tests and comments),
- a numeric constant,
- a number in an `impl Default`, or among the defaults of `settings!`, other than 0, 1, 2 and 1/2,
- any other float literal other than 0, 1, 2 and 1/2.
The first line is the count at commit e963f66, before scales were learnt.
"""

import re
import sys
from pathlib import Path

BEFORE = 334
FOLDERS = ("problem", "factor", "strategy", "tracker", "search", "scene/region")
PLAIN = {0.0, 1.0, 2.0, 0.5}
NUMBER = re.compile(
    r"(?<![\w.])(\d[\d_]*(?:\.\d[\d_]*)?(?:[eE][+-]?\d+)?)(_?(?:f64|f32|usize|u\d+|i\d+))?(?![\w])"
)
CONST = re.compile(r"const \w+: [^=;]*=\s*(.*?);", re.S)
IS_NUMERIC = re.compile(r"const \w+: \[?\(?&?(?:f64|f32|usize|u8|u32|u64|i32|i64)\b")


def code(text):
    """`text` without comments, strings and what only tests compile."""
    text = re.sub(r"//[^\n]*", "", text)
    text = re.sub(r'"(?:[^"\\]|\\.)*"', '""', text)
    while (start := text.find("#[cfg(test)]")) >= 0:
        brace, end = text.find("{", start), text.find(";", start)
        if brace < 0 or 0 <= end < brace:
            text = text[:start] + text[end + 1 :]
            continue
        text = text[:start] + text[block_end(text, brace) :]
    return text


def block_end(text, brace):
    """The place behind the block that begins at `brace`."""
    depth = 0
    for at in range(brace, len(text)):
        depth += {"{": 1, "}": -1}.get(text[at], 0)
        if depth == 0:
            return at + 1
    return len(text)


def numbers(text, floats_only):
    found = []
    for match in NUMBER.finditer(text):
        literal, suffix = match.group(1).replace("_", ""), match.group(2) or ""
        # The end of a literal such as `1..2` or `x.0` is none of a float.
        is_float = "." in literal or "e" in literal.lower() or suffix in ("f64", "f32", "_f64", "_f32")
        if floats_only and not is_float:
            continue
        if float(literal) not in PLAIN:
            found.append(literal)
    return found


def tuned(path):
    text, found = code(path.read_text()), []
    for match in list(CONST.finditer(text))[::-1]:
        if IS_NUMERIC.match(match.group(0)) and re.search(r"\d|[A-Z]", match.group(1)):
            found.append(match.group(0).split("=")[0].strip())
            text = text[: match.start()] + text[match.end() :]
    while match := re.search(r"impl Default for \w+[^{]*|settings!\s*", text):
        end = block_end(text, match.end())
        found += [f"Default: {number}" for number in numbers(text[match.end() : end], False)]
        text = text[: match.start()] + text[end:]
    return found + [f"literal: {number}" for number in numbers(text, True)]


def main():
    source = Path(__file__).resolve().parents[2] / "crates/refine/src"
    total = 0
    print(f"before: {BEFORE}")
    for folder in FOLDERS:
        count = 0
        for path in sorted((source / folder).rglob("*.rs")):
            if path.name == "tests.rs" or path.name.startswith("gradient_check"):
                continue
            found = tuned(path)
            count += len(found)
            if "--list" in sys.argv and found:
                print(path.relative_to(source), *found, sep="\n    ")
        print(f"{folder:10} {count:4}")
        total += count
    print(f"together   {total:4}, {total / BEFORE:.2f} of before")


if __name__ == "__main__":
    main()
