"""Colours of the site, from the list of colours that playbacks and figures use."""

from __future__ import annotations

from drake_rnn import colours

# Share of white in a colour on a dark ground, so that text in it can be read.
_LIGHTENED = 0.45


def lightened(colour: str, share: float) -> str:
    """Return a colour mixed with white."""
    parts = (component + share * (1.0 - component) for component in colours.components(colour))
    return "#" + "".join(f"{round(255 * part):02X}" for part in parts)


def furo_variables(*, dark: bool) -> dict[str, str]:
    """Return the theme's variables for a light or a dark ground."""
    main, visited = colours.DESIRED, colours.TARGET
    if dark:
        main, visited = lightened(main, _LIGHTENED), lightened(visited, _LIGHTENED)
    return {
        "color-brand-primary": main,
        "color-brand-content": main,
        "color-brand-visited": visited,
        "drake-rnn-accent": colours.TRACED,
    }
