"""Does a failure mean something? Controls beside the search: nobody attacks, chance attacks, better and worse egos."""
