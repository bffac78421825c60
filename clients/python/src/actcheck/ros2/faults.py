"""Faults of the bridge, by whom they are caused."""


class BrokenNode(Exception):
    """A node under test, or its mapping, is at fault: the run is broken and says nothing about the robot."""


class MappingFault(Exception):
    """A mapping file can't be used. Holds all faults, each with the place in the file."""

    def __init__(self, faults: list[str]) -> None:
        super().__init__("\n".join(faults))
        self.faults = faults
