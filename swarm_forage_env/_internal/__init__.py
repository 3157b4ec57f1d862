"""Tools of this distribution without a promise to users: compiling, files, messages, random streams."""
