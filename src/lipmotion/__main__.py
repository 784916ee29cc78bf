"""``python -m lipmotion VERB ...``: the command line."""

import sys

from lipmotion.cli.main import main

if __name__ == "__main__":  # not in worker processes, which import this module under another name
    sys.exit(main())
