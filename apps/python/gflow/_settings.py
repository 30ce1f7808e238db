# SPDX-License-Identifier: Apache-2.0
"""Settings of training as keyword arguments."""
from gflow import _core


def as_text(value):
    """A value as the settings of the command line take it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float, str)):
        return str(value)
    if hasattr(value, "item") and not getattr(value, "ndim", 0):  # a NumPy number
        return as_text(value.item())
    raise TypeError(f"a setting has the value {value!r}, expected a number, a bool or a text")


def assignments(settings, section=""):
    """["flow.weight=0.2", ...] of {"flow": {"weight": 0.2}} or {"flow.weight": 0.2}."""
    result = []
    for name, value in settings.items():
        full = f"{section}.{name}" if section else name
        if isinstance(value, dict):
            result += assignments(value, full)
        elif "." not in full:
            known = sorted({setting["name"].split(".")[0] for setting in _core.settings()})
            instead = (f'give a dict, {full}={{"name": value}}' if full in known
                       else f"the sections of settings are {', '.join(known)}")
            raise TypeError(f"there is no argument '{full}' with the value {value!r}: {instead}")
        else:
            result.append(f"{full}={as_text(value)}")
    return result
