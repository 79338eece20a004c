"""Calls as what a file says (host); `schema` has the way back."""

import os
import pathlib
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from mjx_arenas.files.text import Path, dotted
from mjx_arenas.furniture import Part
from mjx_arenas.problem import Problem
from mjx_arenas.spec import calls, specs
from mjx_arenas.spec.calls import Call, Made
from mjx_arenas.textures import Texture


class Writer:
    """Makes plain data of calls, and collects what cannot be written."""

    def __init__(self, file: pathlib.Path) -> None:
        self.folder, self.stem = os.path.abspath(file.parent), file.stem
        self.problems: list[Problem] = []
        self.specs: dict[str, mujoco.MjSpec] = {}  # by the path of the MJCF that is to hold each

    def arena(self, made: Sequence[Call], at: Path) -> dict[str, Any]:
        first, *others = made
        data = {"type": first.function.__qualname__, **self.arguments(first, at)}
        if others:
            data["then"] = [self.named(call, (*at, "then", i)) for i, call in enumerate(others)]
        return data

    def named(self, call: Call, at: Path) -> dict[str, Any]:
        """`{name: arguments}`; those that are required alone, where there are no others."""
        name = call.function.__name__
        arguments = self.arguments(call, (*at, name))
        required = [key for key, parameter in calls.parameters(call.function).items() if parameter.required]
        values = list(arguments.values())
        if list(arguments) != required or any(isinstance(value, dict) for value in values):
            return {name: arguments}
        return {name: values[0] if len(values) == 1 else values or {}}

    def arguments(self, call: Call, at: Path) -> dict[str, Any]:
        known = calls.parameters(call.function)
        paths = {key for key, parameter in known.items() if parameter.is_path}
        return {key: self.value(value, (*at, key), key in paths) for key, value in call.arguments.items()}

    def value(self, value: Any, at: Path, is_path: bool = False) -> Any:
        if is_path and isinstance(value, str) and not specs.is_mjcf(value):
            return self.relative(value)
        if is_path and isinstance(value, mujoco.MjSpec):
            path = f"{self.stem}_given{len(self.specs)}/spec.xml"
            self.specs[path] = value
            return path
        if isinstance(value, Call) and isinstance(value.function, type) and issubclass(value.function, (Texture, Part)):
            return self.named(value, at)
        if isinstance(value, Call):
            arguments = self.arguments(value, at)
            return arguments["name"] if list(arguments) == ["name"] else arguments  # an object of which no more is said
        if isinstance(value, Made):
            return self.arena(value, at)
        if isinstance(value, list):
            return [self.value(item, (*at, i)) for i, item in enumerate(value)]
        if value is None or isinstance(value, (bool, int, float, str)):
            return value
        if isinstance(value, np.ndarray):
            self.problems.append(Problem(dotted(at), "unwritable_pixels"))
            return None
        self.problems.append(Problem(dotted(at), "unwritable", numbers={"kind": type(value).__name__}))
        return None

    def relative(self, path: str) -> str:
        """Relative to the file's folder, unless the two have nothing but the root in common."""
        common = os.path.commonpath([path, self.folder])
        return path if common == os.path.sep else os.path.relpath(path, self.folder)
