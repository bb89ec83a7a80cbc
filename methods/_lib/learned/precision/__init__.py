"""How far each measurement is off and is to be trusted, learned around a solution of consensus."""
