from robot_model import Recording


def require_units(recording: Recording) -> None: ...
