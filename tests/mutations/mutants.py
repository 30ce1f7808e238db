"""The mutation operators: what they change in kernels and host code.

They rely on the format of the tree (clang-format): a binary operator has a space on both sides, a pointer has not.
"""
import random
import re
from collections import namedtuple

Mutant = namedtuple("Mutant", "operator start end new")  # text[start:end] becomes new

# Never changed: comments, strings, characters, includes and preprocessor conditions, static_assert.
MASKED = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])\'|'
                    r"^#(?!define)[^\n]*|static_assert\([^;]*;", re.S | re.M)
SWAPPED = {"+": "-", "-": "+", "*": "/", "/": "*", "+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=",
           "<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==", "&&": "||", "||": "&&",
           "<<": ">>", ">>": "<<", "&": "|", "|": "&", "true": "false", "false": "true",
           "continue;": "break;", "break;": "continue;", "min": "max", "max": "min",
           ".x": ".y", ".y": ".x", ".z": ".x"}
SAME = "\0"  # placeholder for the old text in a new one


def swapped(match):
    return SWAPPED[match[0]]


def negated(match):
    """The condition of an if; none if it declares a variable."""
    text, depth, at = match.string, 1, match.end()
    while depth and at < len(text):
        depth += {"(": 1, ")": -1}.get(text[at], 0)
        at += 1
    condition = text[match.end() : at - 1]
    if ";" in condition or re.match(r"(const|auto)\b", condition):
        return None
    return match.end(), at - 1, f"!({SAME})"


def constant(match):
    number, suffix = match[1], match[2]
    if "." not in number and "e" not in number:
        return str(int(number) + 1) + suffix
    return repr(2 * float(number) or 1.0) + suffix


def off_by_one(match):
    before = match.string[max(0, match.start() - 80) : match.start()]
    declared = re.search(r"(?:(\w+)|[*&>]) (?:restrict )?\w+$", before)
    if declared and declared[1] not in ("return", "else", "case"):
        return None
    return f"[({match[1]}) + 1]"


def dropped(match):
    """The statement after what LINE matches."""
    return match.end(1), match.end(), ";"


def returned(match):
    """Inserts at the start of the body."""
    return match.end(), match.end(), " return;"


ANY, KERNEL, HOST = "any", "kernel", "host"
PLACE = r"\*?[\w.]+(?:->[\w.]+)*(?:\[[^;=\n]*\])*(?:\.\w+)?"  # an assigned expression; a declaration would contain a space
LINE = r"(?m)^( +(?:\} )?(?:else )?(?:(?:if|for) \([^{}\n]*\) )?)"  # the text before a statement
# name, where, pattern, function: match -> new text, or (start, end, new text), or None for no mutant
OPERATORS = [
    ("arithmetic", ANY, r"(?<=[\w)\]}] )[-+*/](?=\s+[\w(-])", swapped),
    ("assignment", ANY, r"(?<= )[-+*/]=(?=\s)", swapped),
    ("comparison", ANY, r"(?<= )(?:[<>]=?|[=!]=)(?=\s)", swapped),
    ("logic", ANY, r"(?<= )(?:&&|\|\|)(?=\s)", swapped),
    ("bits", KERNEL, r"(?<= )(?:<<|>>|&|\|)(?=\s)", swapped),
    ("negate", ANY, r"\bif \(", negated),
    ("sign", ANY, r"(?:(?<=[=(,?:\[{] )|(?<=[(\[{])|(?<=return ))-(?=[\w(])", lambda m: ""),
    ("minimum", ANY, r"(?<=\bf)(?:min|max)(?=\()|\b(?:min|max)(?=\()", swapped),
    ("boolean", ANY, r"\b(?:true|false)\b", swapped),
    ("loop", ANY, r"\b(?:break|continue);", swapped),
    ("component", ANY, r"(?<=[\w)\]])\.[xyz]\b(?!\()", swapped),
    ("constant", ANY, r"(?<![\w.\[])(\d+(?:\.\d*)?(?:e-?\d+)?)([fFuUlL]*)(?![\w.'])", constant),
    ("index", ANY, r"(?<=\w)\[([^\[\]\"\n]+)\]", off_by_one),
    ("drop assignment", ANY, LINE + PLACE + r" [-+*/|&^]?= [^;{}]*;", dropped),
    ("drop call", ANY, LINE + r"(?!barrier)(?:[\w:.\[\]]|->)+\([^;{}]*\);", dropped),
    ("drop barrier", KERNEL, r"\bbarrier\([^;]*;", lambda m: ";"),
    ("return early", ANY, r"(?m)^(?:kernel )?(?:static )?(?:inline )?void [^;{}]*\)[^;{}()]*\{", returned),
    ("return nothing", HOST, r"\breturn [^;{}]+;", lambda m: "return {};"),
]


def is_kernel(path):
    return path.endswith((".cl", ".h"))


def mutants(path, text, seed):
    """All mutants of a file, shuffled and interleaved, so that the first few use many operators."""
    code = MASKED.sub(lambda m: re.sub(r"[^\n]", "\"", m[0]), text)
    kinds = []
    for name, where, pattern, change in OPERATORS:
        if where != ANY and (where == KERNEL) != is_kernel(path):
            continue
        found = []
        for match in re.finditer(pattern, code):
            new = change(match)
            if isinstance(new, str):
                new = match.start(), match.end(), new
            if new:
                start, end, new = new
                found.append(Mutant(name, start, end, new.replace(SAME, text[start:end])))
        kinds.append(found)
    chance = random.Random(f"{seed} {path.rsplit('/', 1)[-1]}")
    for found in kinds:
        chance.shuffle(found)
    chance.shuffle(kinds)
    while any(kinds):
        for found in kinds:
            if found:
                yield found.pop()
