"""The command line as a module: ``python -m dualbend``."""

from dualbend.cli import main

if __name__ == "__main__":
    main()
