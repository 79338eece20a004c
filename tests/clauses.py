"""What functions may say: the texts in their code, and in that of what they call."""

import types


def of(function, seen=None):
    """Pieces of texts with a blank in them, of a function of this library and all that it calls or holds, without docstrings."""
    seen = set() if seen is None else seen
    function = getattr(function, "refused", function)  # of an attribute, which asks another one
    if not isinstance(function, types.FunctionType) or function in seen:
        return {function.strip()} if isinstance(function, str) and " " in function.strip() else set()
    if not function.__module__.startswith("mjx_arenas"):
        return set()
    seen.add(function)
    found: set[str] = set()
    for code in codes(function.__code__):
        found |= {text.strip() for text in texts(code) if " " in text.strip()}
        for name in code.co_names:
            found |= of(function.__globals__.get(name), seen)
    for cell in function.__closure__ or ():
        found |= of(cell.cell_contents, seen)
    return found


def codes(code):
    """A code and those of the functions in it."""
    yield code
    for const in code.co_consts:
        if isinstance(const, types.CodeType):
            yield from codes(const)


def texts(code):
    """Its texts without its docstring."""
    consts = code.co_consts[1:] if code.co_consts and isinstance(code.co_consts[0], str) else code.co_consts
    return [const for const in consts if isinstance(const, str)]
