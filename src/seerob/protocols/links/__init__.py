"""What carries bytes: connections, datagrams, sockets of the web, and how numbers lie in them."""
