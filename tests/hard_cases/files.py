"""Hard cases of files from strangers: nothing in them is executed, and all of it is bounded."""
