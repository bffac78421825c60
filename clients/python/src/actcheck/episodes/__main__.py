"""`python -m actcheck.episodes`."""

import sys

from actcheck.episodes.command import main

sys.exit(main())
