"""Is it plausible? What a workstation file says, against ranges that are data."""
