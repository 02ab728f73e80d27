"""Networks: the published one, the recurrent one of `best`, those that give pictures, and a user's own."""
