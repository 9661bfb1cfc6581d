"""A genetic algorithm that searches near the previous point: GA-REB (progressive reduction of the search space) [2]."""
