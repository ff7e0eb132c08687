"""Claims that are quickly judged."""

SHORT = {"duration": 0.05}


def error_below(bound, **changes):
    run = {"run": "pinv_line", "set": SHORT | changes}
    return run | {"metric": "position_error_max_m", "at_most": bound}


def claim(number, **fields):
    return {"id": f"jdf-C{number}", "where": f"place {number}", "says": "Something.", **fields}


#: Of each verdict one. The file is named as a shipped one, so its measures are known.
CLAIMS = {
    "prefix": "jdf",
    "paper": {"title": "A paper", "authors": "Somebody"},
    "page": "README.md",
    "claims": [
        claim(1, as_stated=[error_below(1.0), {"measure": "projection_residual", "at_most": 1e-9}]),
        claim(
            2,
            as_stated=[error_below(1.0) | {"at_least": 0.5}],
            corrected=[error_below(1.0, seed=3)],
            because="A <b>seed</b> | is better.",
        ),
        claim(
            3,
            as_stated=[
                {
                    "measure": "joint_speed_at_end",
                    "given": {"experiment": "pinv_line", "changes": {"duration": 0.1}},
                    "at_least": 1.0,
                }
            ],
            instead=[error_below(1.0) | {"wide_because": "an <i>example</i>"}],
        ),
        claim(4, unchecked="Its cells are lost."),
    ],
}
