"""Files of characters and rigs: glTF, VRM, OBJ, USD, tables."""
