"""Nouns of objects that training knows from cutouts alone (``prepare cutouts``)."""

from diff4splat.captions.vocabulary import NOUNS

CUTOUT_NOUNS = tuple(
    """
abacus, accordion, alien, ambulance, anchor, angel, ant, apple, aquarium, astronaut, aubergine,
avocado, axe, baby, backpack, bacon, badger, bag, bagel, banana, banjo, barber pole, basket,
basketball, bat, bathtub, battery, bean, bear, beaver, bed, bee, beetle, bell, bicycle, bin, bison,
boar, boat, bomb, bone, book, boomerang, boot, bouquet, boy, brain, bread, brick, briefcase,
broccoli, broom, brush, bucket, buffalo, burger, burrito, bus, butter, butterfly, cabinet, cactus,
cake, calculator, calendar, camel, camera, candle, candy, canoe, cap, carrot, castle, cat, cello,
cheese, cherry, chestnut, chick, chicken, chicken leg, child, chili pepper, chocolate, church,
clipboard, clock, cloud, coat, cockroach, cocktail glass, coconut, coffin, coin, comb, compass,
computer, computer mouse, cook, cookie, corn, couch, cow, crab, crayon, crib, cricket, crocodile,
croissant, crow, crown, crystal ball, cucumber, cupcake, cyclist, dagger, dancer, deer, diamond,
die, dinosaur, disc, disk, doctor, dodo, dog, doll, dolphin, donkey, door, doughnut, dragon, dress,
drill, duck, dumpling, eagle, ear, egg, elephant, elf, envelope, eraser, eye, face, fairy, fan,
farmer, fax machine, feather, ferris wheel, fire, fire engine, fire extinguisher, firecracker,
firefighter, fireplace, fishing rod, fist, flamingo, flute, foot, fork, fountain, fox, fridge,
fries, frog, fuel pump, game controller, garlic, ghost, gift, giraffe, girl, glass, glasses, glove,
goat, goggles, golfer, goose, gorilla, gourd, grapes, guard, guitar, hammer, hammock, hamster, hand,
handbag, harp, hat, headphones, headstone, hedgehog, helicopter, helmet, hen, hippo, honey jar,
hook, horn, horse, hot dog, hourglass, hut, ice cream, ice cube, jacket, jar, jeep, jellyfish,
joystick, kangaroo, key, keyboard, kite, kiwi, knife, koala, ladder, ladybird, ladybug, lantern,
laptop, lasagna, lawn mower, leaf, leg, lemon, leopard, letter box, light bulb, lighthouse, lion,
lipstick, lizard, llama, lobster, lock, log, lollipop, magnet, magnifying glass, mammoth, man,
mango, maracas, mechanic, medal, megaphone, melon, microphone, microscope, mirror, mitten, modem,
monitor, monkey, moose, mosque, mosquito, motorcycle, mouse, muffin, nest, newspaper, nose,
notebook, octopus, olive, onion, orange fruit, orangutan, otter, oven, owl, ox, painter, palette,
palm tree, pan, pancake, panda, paperclip, parachute, parrot, pawn, peach, peacock, pear, pen,
pencil, penguin, pepper, person, petri dish, phone, piano, pickaxe, pie, pig, pill, pin, pinata,
pineapple, pizza, plane, plate, plug, plunger, police officer, popcorn, potato, pretzel, prince,
princess, printer, projector, pudding, puzzle piece, rabbit, raccoon, racket, radiator, radio, ram,
rat, razor, rhino, rice ball, rickshaw, ring, robot, rocket, roller skate, rooster, rose, ruler,
runner, sailboat, salt shaker, sandal, sandwich, satellite, satellite dish, sausage, saxophone,
scales, scanner, scarf, scissors, scooter, scorpion, screw, screwdriver, scroll, seahorse, seal,
shark, sheep, shell, shield, ship, shirt, shoe, shovel, shrimp, sign, sink, skate, skateboard, ski,
skier, skirt, skull, skunk, sled, slipper, sloth, snail, snowboarder, snowman, soap, sock, sombrero,
spaceship, speaker, spider, sponge, spool, spoon, squid, squirrel, stapler, statue, steak,
stethoscope, stone, stove, strawberry, stroller, student, suit, suitcase, sunflower, sunglasses,
surfer, sushi, swan, syringe, taco, tape measure, target, teapot, teddy bear, telephone, telescope,
television, tent, test tube, tie, tiger, toaster, toilet, tomato, toolbox, tooth, toothbrush, torch,
tractor, traffic light, train, tram, trampoline, tray, treadmill, tricycle, trolley, trophy,
trousers, truck, trumpet, turban, turkey, turtle, umbrella, unicorn, vacuum, vampire, van, vest,
violin, waffle, wand, wardrobe, washing machine, wasp, watch, watermelon, whale, wheel, wheelbarrow,
wheelchair, window, wine glass, wizard, wolf, woman, worker, wrench, x-ray, xylophone, yo-yo, zebra,
zombie
""".replace("\n", " ")
    .strip()
    .split(", ")
)
ALL_NOUNS = (*NOUNS, *CUTOUT_NOUNS)
