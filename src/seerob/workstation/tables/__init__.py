"""Tables of the workstation file, one file each."""
