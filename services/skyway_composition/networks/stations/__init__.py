"""The stations of networks: listed, looked for by id, told at once to those who ask for many."""
