"""A genetic algorithm that searches near the point before: GA-REB (progressive reduction of the search space) [2]."""
