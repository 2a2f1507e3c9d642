"""`python -m handctl` is the same program as `handctl`."""

import sys

from handctl.cli import main

sys.exit(main())
