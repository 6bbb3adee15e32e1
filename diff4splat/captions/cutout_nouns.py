"""Nouns of objects that training knows from cutouts alone (``prepare cutouts``)."""

from diff4splat.captions.vocabulary import NOUNS

CUTOUT_NOUNS = tuple(
    """
abacus, accordion, alien, ambulance, anchor, angel, ant, apple, astronaut, aubergine, avocado,
axe, baby, backpack, bacon, badger, bag, bagel, banana, banjo, barber pole, basket, bat,
bathtub, battery, bean, bear, beaver, bed, bee, beetle, bell, bicycle, bin, bison, boar, boat,
bomb, bone, book, boomerang, boot, bouquet, boy, brain, bread, brick, briefcase, broccoli,
broom, brush, bucket, buffalo, burger, burrito, bus, butter, butterfly, cabinet, cactus, cake,
calculator, camel, candle, candy, canoe, cap, carrot, castle, cat, cello, cheese, cherry,
chestnut, chick, chicken, chicken leg, child, chili pepper, chocolate, church, clipboard, clock,
cloud, coat, cockroach, cocktail glass, coconut, coffin, coin, comb, compass, computer, computer
mouse, cook, cookie, corn, couch, cow, crab, crayon, cricket, crocodile, croissant, crow, crown,
crystal ball, cucumber, cupcake, cyclist, dagger, dancer, deer, diamond, die, dinosaur, disc,
disk, doctor, dodo, dog, doll, dolphin, donkey, door, doughnut, dragon, dress, duck, dumpling,
eagle, ear, egg, elephant, elf, envelope, eraser, eye, face, fairy, fan, farmer, fax machine,
feather, ferris wheel, fire, fire engine, fire extinguisher, firecracker, firefighter, fishing
rod, fist, flamingo, flute, foot, fountain, fox, fries, frog, fuel pump, game controller,
garlic, ghost, giraffe, girl, glass, glasses, glove, goat, goggles, golfer, goose, gorilla,
gourd, grapes, guard, guitar, hammer, hamster, hand, harp, hat, headphones, headstone, hedgehog,
helicopter, helmet, hen, hippo, honey jar, hook, horn, horse, hot dog, hourglass, hut, ice
cream, ice cube, jar, jeep, jellyfish, joystick, kangaroo, key, keyboard, kite, kiwi, knife,
koala, ladder, ladybird, ladybug, lantern, laptop, lasagna, leaf, leg, lemon, leopard, letter
box, light bulb, lighthouse, lion, lipstick, lizard, llama, lobster, lock, log, lollipop,
magnet, magnifying glass, mammoth, man, mango, maracas, mechanic, medal, megaphone, melon,
microphone, microscope, mirror, mitten, modem, monitor, monkey, moose, mosque, mosquito,
motorcycle, mouse, muffin, nest, newspaper, nose, notebook, octopus, olive, onion, orange fruit,
orangutan, otter, owl, ox, painter, palette, palm tree, pan, pancake, panda, paperclip,
parachute, parrot, pawn, peach, peacock, pear, pen, pencil, penguin, pepper, person, petri dish,
phone, piano, pickaxe, pie, pig, pill, pin, pinata, pineapple, pizza, plane, plate, plug,
plunger, police officer, popcorn, potato, pretzel, prince, princess, printer, projector,
pudding, puzzle piece, rabbit, raccoon, racket, radio, ram, rat, razor, rhino, rice ball,
rickshaw, ring, robot, rocket, roller skate, rooster, rose, ruler, runner, sailboat, salt
shaker, sandal, sandwich, satellite, satellite dish, sausage, saxophone, scales, scanner, scarf,
scissors, scooter, scorpion, screw, screwdriver, scroll, seahorse, seal, shark, sheep, shell,
shield, ship, shirt, shoe, shovel, shrimp, sign, skate, skateboard, ski, skier, skull, skunk,
sled, sloth, snail, snowboarder, snowman, soap, sock, sombrero, spaceship, speaker, spider,
sponge, spool, spoon, squid, squirrel, statue, steak, stethoscope, stone, strawberry, student,
suitcase, sunflower, surfer, sushi, swan, syringe, taco, target, teapot, teddy bear, telephone,
telescope, television, tent, test tube, tie, tiger, toilet, tomato, toolbox, tooth, toothbrush,
torch, tractor, traffic light, train, tram, trolley, trophy, trousers, truck, trumpet, turban,
turkey, turtle, umbrella, unicorn, vacuum, vampire, van, vest, violin, waffle, wand, wasp,
watermelon, whale, wheel, wheelchair, window, wine glass, wizard, wolf, woman, worker, wrench,
x-ray, yo-yo, zebra, zombie
""".replace("\n", " ")
    .strip()
    .split(", ")
)
MESH_NOUNS = tuple(
    """
aquarium, basketball, calendar, camera, crib, drill, fireplace, fork, fridge, gift, hammock,
handbag, jacket, lawn mower, oven, radiator, sink, skirt, slipper, stapler, stove, stroller, suit,
sunglasses, tape measure, toaster, trampoline, tray, treadmill, tricycle, wardrobe, washing machine,
watch, wheelbarrow, xylophone
""".replace("\n", " ")
    .strip()
    .split(", ")
)
"""Of cutouts of meshes (``prepare mesh-cutouts``). No bundled weights were trained with them: a
prompt that has nothing but one of them moves nothing."""
KNOWN_NOUNS = (*NOUNS, *CUTOUT_NOUNS)
"""Those of the bundled weights."""
ALL_NOUNS = (*KNOWN_NOUNS, *MESH_NOUNS)
