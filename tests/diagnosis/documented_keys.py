"""The documented keys and types of diagnosis.json."""

from __future__ import annotations

#: Keys and types as the interface documents them; a list holds items of its first element's shape.
SHAPE = {
    "schema": int,
    "robot": str,
    "recordings": [str],
    "validation": [str],
    "verdict": str,
    "summary": str,
    "mismatch": [
        {
            "location": str,
            "channel": str,
            "share": float,
            "p_value": float,
            "windows": [[float]],
            "depends_on": [{"variable": str, "range": [float], "share": float}],
            "frequency_hz": [float],
        }
    ],
    "findings": [
        {
            "effect": str,
            "location": str,
            "probability": float,
            "parameters": {"*": {"value": float, "ci95": [(float, type(None))], "unit": str}},
            "ambiguous_with": [str],
            "alternatives": [{"effect": str, "location": str, "probability": float, "why_not": str}],
            "note": str,
        }
    ],
    "fit": {
        "channels": {
            "*": {
                "standard": (dict, type(None)),
                "unit": str,
                "before": {"train_rms": float, "validation_rms": float},
                "after": {"train_rms": float, "validation_rms": float},
                "noise_floor": float,
            }
        },
        "validation_improvement": float,
    },
    "experiments": [{"separates": [str], "do": str, "why": str, "motion": (str, type(None))}],
    "could_not_tell": [str],
    "unnamed": [
        {
            "location": str,
            "channel": str,
            "unit": str,
            "depends_on": [str],
            "share": float,
            "left": float,
            "knots": [[float]],
            "curves": [{"carrier": str, "torque": [float], "ci95": [[float]]}],
            "words": str,
        }
    ],
    "nominal_changes": [{"name": str, "nominal": float, "estimate": float}],
    "comparison": {
        "channels": {
            "*": {
                "unit": str,
                "nominal": {"train_rms": float, "validation_rms": float},
                "standard": (dict, type(None)),
                "answer": {"train_rms": float, "validation_rms": float},
                "noise": float,
            }
        },
        "written": str,
        "worse": [str],
        "words": str,
    },
    "log_score": (dict, type(None)),
    "timing": [{"recording": str, "channel": str, "offset": float, "ci95": [float], "samples": float}],
    "not_judged": [str],
    "augmented_robot": str,
}


def check(found: object, shape: object, where: str = "diagnosis.json") -> None:
    if isinstance(shape, dict):
        assert isinstance(found, dict), where
        if "*" in shape:
            for key, item in found.items():
                check(item, shape["*"], f"{where}.{key}")
        else:
            assert set(shape) <= set(found), where
            for key, item in shape.items():
                check(found[key], item, f"{where}.{key}")
    elif isinstance(shape, list):
        assert isinstance(found, list), where
        for item in found:
            check(item, shape[0], f"{where}[]")
    else:
        assert isinstance(found, shape), where  # type: ignore[arg-type]
        assert not isinstance(found, bool), where
