"""Write every picture beside this file."""

from tests.pictures import HERE, PICTURES, draw

for name in PICTURES:
    (HERE / f"{name}.svg").write_text(draw(name), encoding="utf-8")
    print(HERE / f"{name}.svg")
