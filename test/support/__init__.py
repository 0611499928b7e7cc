"""What the tests of both folders share."""
