"""``python -m mobman``."""

from mobman.cli.main import main

if __name__ == "__main__":
    main()
