"""A company's own rules, in its own package: nothing in seerob knows of them."""
