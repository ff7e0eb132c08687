"""How recurrent networks follow the optimum of a program that changes with time."""
