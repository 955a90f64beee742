/* Constants that several libraries need. */

const float MATH_PI = 3.14159265358979;
