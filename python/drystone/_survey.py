class NotTheSame(Exception): pass
class Rows: pass
def survey(): pass
