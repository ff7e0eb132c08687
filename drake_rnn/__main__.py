"""Entry point of ``python -m drake_rnn``."""

from .cli import main

if __name__ == "__main__":
    try:
        main()
    finally:
        # Python ends a module by the signal of an interrupt that was raised in code made of a text,
        # as a dataclass's methods are, even if it was caught; the next such code makes it forget.
        exec("")
